"""What every room shares: errors, the frame grid, keypoints, vectors, joint trajectories, settings files."""
