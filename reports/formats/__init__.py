"""Write a conformance result in the formats that CI systems and code hosts read: one module for each format."""
