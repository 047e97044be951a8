"""Choosing the gesture: the k-NN search of MM22, its control masks, emotions, and semantic banks."""
