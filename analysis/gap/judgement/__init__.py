"""What is called, on captures that nothing was fitted to, and what that comes to in words and numbers."""
