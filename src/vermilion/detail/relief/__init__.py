"""Fine relief of the skin from its shading (Mono13 section 8)."""
