"""What the regressors are compared with: the contour tracker of Lips16 section 6."""
