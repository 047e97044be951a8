"""Sound and text in: 15 Hz speech features, spoken words with their times, keywords."""
