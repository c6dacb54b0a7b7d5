"""What tests share: pictures, ways to change them, tools."""
