"""Contact in the current configuration: closest points, their derivatives and slip as surfaces slide far."""
