"""What cameras and files did to captures before they came here, told and taken back."""
