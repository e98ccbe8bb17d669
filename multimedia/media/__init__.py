"""Cameras and what lies between camera and object: interfaces, ray tracing, projection."""
