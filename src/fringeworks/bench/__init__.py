"""Speed and accuracy as metrics, beside the peers."""
