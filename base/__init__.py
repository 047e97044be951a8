"""What every room shares: errors, the frame grid, keypoints, joint trajectories, settings files."""
