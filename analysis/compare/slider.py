"""Two pictures of one thing with a line between them that is drawn across: HTML without anything from elsewhere."""

import base64
import html
from collections.abc import Mapping, Sequence

import cv2
import numpy as np

LEAST = 480  # px: smaller pictures are enlarged
LARGE = 120_000  # bytes from which a picture is a JPEG

STYLE = """
.ab{margin:10px 0 4px}.ab .stage{position:relative;width:100%;max-width:760px;background:#000;line-height:0;
overflow:hidden;cursor:ew-resize;touch-action:pan-y;user-select:none}
.ab img{width:100%;image-rendering:pixelated;display:block}
.ab .over{position:absolute;inset:0;clip-path:inset(0 50% 0 0)}
.ab .rule{position:absolute;top:0;bottom:0;left:50%;width:2px;margin-left:-1px;background:#fff;box-shadow:0 0 4px #000}
.ab .rule:after{content:"";position:absolute;top:50%;left:-11px;width:24px;height:24px;margin-top:-12px;
border-radius:12px;background:#fff;box-shadow:0 0 4px #0008}
.ab .tag{position:absolute;top:8px;background:#000a;color:#fff;font-size:13px;line-height:1;padding:5px 8px;
border-radius:3px}.ab .tag.l{left:8px}.ab .tag.r{right:8px}
.ab .pick{display:flex;gap:18px;flex-wrap:wrap;margin:6px 0}.ab .pick label{color:#5c6b78;font-size:.9em}
.ab select{font:inherit;padding:2px 4px}
"""

SCRIPT = """
document.querySelectorAll('.ab').forEach(function(ab){
  var stage=ab.querySelector('.stage'),over=ab.querySelector('.over'),rule=ab.querySelector('.rule'),held=false;
  function at(x){var r=stage.getBoundingClientRect(),p=Math.max(0,Math.min(100,100*(x-r.left)/r.width));
    over.style.clipPath='inset(0 '+(100-p)+'% 0 0)';rule.style.left=p+'%'}
  stage.addEventListener('pointerdown',function(e){held=true;stage.setPointerCapture(e.pointerId);at(e.clientX)});
  stage.addEventListener('pointermove',function(e){if(held)at(e.clientX)});
  stage.addEventListener('pointerup',function(){held=false});
  function show(){var c=ab.querySelector('.which').value;['l','r'].forEach(function(s){
    var k=ab.querySelector('select.'+s),name=k.options[k.selectedIndex].text;
    ab.querySelector('.stage img.'+s).src=document.getElementById('p'+c+'_'+k.value).src;
    ab.querySelector('.tag.'+s).textContent=name})}
  ab.querySelectorAll('select').forEach(function(k){k.addEventListener('change',show)});show();
});
"""


def slider(cases: Mapping[str, Mapping[str, np.ndarray]], left: str, right: str) -> str:
    """``cases``: for each thing its pictures by name, (H, W, 3) uint8; ``left``, ``right``: the names shown first.

    A page holds one slider; it needs ``STYLE`` and, behind it, ``SCRIPT``.
    """
    names = list(next(iter(cases.values())))
    store = "".join(
        f'<img id="p{k}_{names.index(name)}" src="{data_uri(picture)}" alt="" hidden>'
        for k, pictures in enumerate(cases.values())
        for name, picture in pictures.items()
    )
    which = "".join(f'<option value="{k}">{html.escape(words)}</option>' for k, words in enumerate(cases))
    hidden = " hidden" if len(cases) == 1 else ""
    many = f'<label{hidden}>image <select class="which">{which}</select></label>'
    return (
        f'<div class="ab"><div class="pick">{many}<label>left {_side("l", names, left)}</label>'
        f"<label>right {_side('r', names, right)}</label></div>"
        '<div class="stage"><img class="r" alt=""><img class="l over" alt=""><div class="rule"></div>'
        f'<span class="tag l"></span><span class="tag r"></span></div></div>{store}'
    )


def _side(side: str, names: Sequence[str], chosen: str) -> str:
    options = "".join(
        f'<option value="{i}"{" selected" if n == chosen else ""}>{html.escape(n)}</option>'
        for i, n in enumerate(names)
    )
    return f'<select class="{side}">{options}</select>'


def data_uri(picture: np.ndarray) -> str:
    """A PNG (a JPEG where that would be large) of (H, W, 3) uint8, as text."""
    factor = -(-LEAST // picture.shape[1])
    if factor > 1:
        picture = np.repeat(np.repeat(picture, factor, axis=0), factor, axis=1)
    bgr = np.ascontiguousarray(picture[..., ::-1])
    kind, data = "png", cv2.imencode(".png", bgr, [cv2.IMWRITE_PNG_COMPRESSION, 6])[1]
    if len(data) > LARGE:
        kind, data = "jpeg", cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, 92])[1]
    return f"data:image/{kind};base64,{base64.b64encode(data.tobytes()).decode()}"
