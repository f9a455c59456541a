"""Sources of samples: buses to a chip, vehicles over MAVLink, and captures of both; `table` lists them."""
