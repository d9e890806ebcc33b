"""Judge exchanges. A checker sends nothing, and knows neither the checks nor the history."""
