"""How well the texts of a page can be read: contrast and size of each, as the browser draws it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

LEAST_CONTRAST = 4.5  # WCAG 2.2, 1.4.3, level AA
# Every text that is shown: its colour over the colours of all boxes around it, each with its opacity.
# Disabled controls are exempt (WCAG 1.4.3); of a gradient only the colour below it counts.
TEXTS = """() => {
    const canvas = document.createElement('canvas').getContext('2d', { willReadFrequently: true });
    canvas.canvas.width = canvas.canvas.height = 1;
    const known = new Map();
    const rgba = text => {
        if (!known.has(text)) {
            canvas.clearRect(0, 0, 1, 1);
            canvas.fillStyle = text;
            canvas.fillRect(0, 0, 1, 1);
            const [r, g, b, a] = canvas.getImageData(0, 0, 1, 1).data;
            known.set(text, [r, g, b, a / 255]);
        }
        return known.get(text);
    };
    const over = ([r, g, b, a], below) => [r, g, b].map((x, k) => a * x + (1 - a) * below[k]);
    const linear = x => x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4;
    const luminance = colour => {
        const [r, g, b] = colour.map(x => linear(x / 255));
        return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    };
    const contrast = (one, other) => {
        const [low, high] = [luminance(one), luminance(other)].sort((a, b) => a - b);
        return (high + 0.05) / (low + 0.05);
    };
    const dark = document.documentElement.dataset.mantineColorScheme === 'dark';
    const paper = dark ? [36, 36, 36] : [255, 255, 255];
    const texts = [], walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    for (let node = walker.nextNode(); node; node = walker.nextNode()) {
        const element = node.parentElement, text = node.textContent.trim();
        if (!text || !element.checkVisibility({ opacityProperty: true, visibilityProperty: true })) continue;
        if (element.closest('script, style, :disabled, [data-disabled], [aria-disabled=true]')) continue;
        const range = document.createRange();
        range.selectNodeContents(node);
        const box = range.getBoundingClientRect();
        if (!box.width || !box.height) continue;
        const look = getComputedStyle(element), chain = [];
        for (let one = element; one; one = one.parentElement) chain.push(getComputedStyle(one));
        let behind = paper, share = 1;
        for (const one of [...chain].reverse()) behind = over(rgba(one.backgroundColor), behind);
        for (const one of chain) share *= +one.opacity;
        const [r, g, b, a] = rgba(element instanceof SVGElement ? look.fill : look.color);
        texts.push({
            text, size: parseFloat(look.fontSize),
            contrast: contrast(over([r, g, b, a * share], behind), behind),
            inside: [...(element.closest('[class]')?.classList ?? [])].join(' '),
        });
    }
    return texts;
}"""


@dataclass(frozen=True)
class Text:
    """A text of the page: size [px] and contrast to what is behind it; `inside` are the classes around it."""

    text: str
    size: float
    contrast: float
    inside: str


def texts(page: Any) -> list[Text]:
    """Every text that the page shows, disabled controls left out."""
    return [Text(**one) for one in page.evaluate(TEXTS)]


def faint(page: Any) -> list[Text]:
    """The texts that are too faint, in their order on the page."""
    return [one for one in texts(page) if one.contrast < LEAST_CONTRAST]
