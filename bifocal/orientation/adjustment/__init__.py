"""The pair adjusted: observations, what each point sees, unknowns, least squares."""
