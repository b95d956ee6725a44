"""The check of the built pages finds each cell that draws and shows nothing."""

import pytest

from docs._ext.pictures import problems

CELL = """<div class="cell docutils container">
<div class="cell_input docutils container"><div class="highlight"><pre>{code}</pre></div></div>
{output}
</div>
<p><img alt="" src="another.png"/></p>
"""
PICTURE = '<div class="cell_output docutils container"><img alt="" src="a.png"/></div>'
TEXT = '<div class="cell_output docutils container"><div class="output"><pre>&lt;Axes: &gt;</pre></div></div>'


@pytest.mark.parametrize(
    ("code", "output", "found"),
    [
        ("<span>branch</span><span>.</span><span>plot</span>(&quot;max.x&quot;);", "", 1),
        ("branch.plot(&quot;max.x&quot;);", TEXT, 1),
        ("branch.plot(&quot;max.x&quot;);", PICTURE, 0),
        ("gw.plot.draw([branch], &quot;x&quot;);", "", 1),
        ("print(branch)  # to plot() it comes later", TEXT, 0),
    ],
)
def test_a_cell_that_draws_must_show_a_picture(tmp_path, code, output, found) -> None:
    (tmp_path / "page.html").write_text(CELL.format(code=code, output=output), encoding="utf-8")
    told, drawing = problems(tmp_path)
    assert len(told) == found
    assert drawing == ("print" not in code)
    assert all("page.html: no picture" in each for each in told)
