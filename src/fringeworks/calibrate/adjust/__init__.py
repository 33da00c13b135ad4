"""The joint adjustment: what is solved for, its model, its start, its minimum and covariance."""
