"""Systems: descriptor models affine in premises, and the robots they come from."""
