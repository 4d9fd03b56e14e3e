"""What a search for terms comes to: records of discovery and comparison, verdict on the paper's terms, headline."""
