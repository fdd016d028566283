"""What is made of a recording: USD, mesh sequences, pictures. One module each; their packages are optional."""
