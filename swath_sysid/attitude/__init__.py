"""Roll and pitch: measured (motion), modelled (hull), identified (identification), forecast (prediction)."""
