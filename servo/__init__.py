"""From joint trajectories to moving servos: control, envelope, bus, virtual bus."""
