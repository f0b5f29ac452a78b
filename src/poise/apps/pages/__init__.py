"""HTML pages: documents from templates, one style sheet, and the style of all plots.

Every page is one file that needs no network. jinja2 and matplotlib come when a page is made.
"""

from poise.apps.pages._campaign import write_campaign_page as write_campaign_page
from poise.apps.pages._render import render_page, replace_file as replace_file
from poise.apps.pages._style import (
    BAD as BAD,
    COM as COM,
    EVENT as EVENT,
    GOOD as GOOD,
    INK as INK,
    LINE as LINE,
    MUTED as MUTED,
    REFERENCE as REFERENCE,
    SUPPORT as SUPPORT,
    ZMP as ZMP,
    house_style,
    inline_svg,
    line_style as line_style,
    number as number,
    plain as plain,
    power_of_ten as power_of_ten,
)

__all__ = ["house_style", "inline_svg", "render_page"]
