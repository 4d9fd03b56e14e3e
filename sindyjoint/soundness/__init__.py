"""What the data cannot show or show wrongly, each as a sentence with its number."""
