"""Meshes, points on surfaces, alignment, rotations, registration, rays, sparse factors, cameras."""
