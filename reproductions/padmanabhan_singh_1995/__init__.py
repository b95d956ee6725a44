"""The figures of Padmanabhan and Singh (1995), and the checks of what the paper says of them."""
