"""What facets instead of true surfaces cost in pressure and area of contact."""
