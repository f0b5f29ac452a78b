import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

# %% house_style inline_svg
from poise.apps.pages import house_style, inline_svg

with house_style():
    figure, axes = plt.subplots()
    axes.plot([0.0, 1.0], [0.0, 2.0])
    svg = inline_svg(figure, "line", "a line")

# %% render_page
from poise.apps.pages import render_page

template = Path(tempfile.mkdtemp()) / "hello.html.j2"
template.write_text("<h1>{{ title }}</h1>")
page = render_page(template, title="Hello & welcome")  # escaped
