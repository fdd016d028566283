"""The hard cases, by what makes them hard; `clothsim.stability.catalogue` lists them."""
