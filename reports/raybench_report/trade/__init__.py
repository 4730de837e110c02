"""What accuracy costs: `raybench tradeoff`."""
