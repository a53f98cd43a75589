"""Fine relief of the skin from shading (Mono13 section 8)."""
