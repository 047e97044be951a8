"""The studio: one page in the browser on which people see the robot talk, and steer it."""
