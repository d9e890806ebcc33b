"""A conformance result in the forms that CI systems and code hosts read: one module for each."""
