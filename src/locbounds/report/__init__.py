"""What people look at: descriptions and figures."""
