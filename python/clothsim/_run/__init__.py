"""The main job: a scene simulated into a folder, whole or resumable."""
