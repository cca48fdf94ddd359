"""Hand-outs as Chromium prints them.

    sheets_paper.py sheets_on_paper PROGRAM NAME

Prints, of each scene, the pages. Fails where something is cut, lies over another, is not black on white, or is loaded.
"""

import pathlib
import re
import subprocess
import sys
import tempfile

from chromium import browser

PROGRAM = sys.argv[2]

FAULTS = """() => {
  const faults = [];
  const sections = [...document.querySelectorAll("section")];
  for (const [k, section] of sections.entries()) {
    const own = section.getBoundingClientRect();
    if (section.scrollHeight > section.clientHeight || section.scrollWidth > section.clientWidth) {
      faults.push(`section ${k} is cut`);
    }
    let before = null;
    for (const part of section.children) {
      const box = part.getBoundingClientRect();
      if (before !== null && box.top < before - 0.5) faults.push(`section ${k}: ${part.tagName} over another`);
      before = box.bottom;
    }
    for (const cell of section.querySelectorAll("td,th")) {
      if (cell.scrollWidth > cell.clientWidth + 1) faults.push(`section ${k}: ${cell.textContent} is cut`);
    }
    const frame = section.querySelector("svg.map")?.getBoundingClientRect();
    for (const word of section.querySelectorAll("svg.map text:not(.rim)")) {
      const box = word.getBoundingClientRect();
      const inside = box.left >= frame.left - 1 && box.right <= frame.right + 1 && box.bottom <= frame.bottom + 4;
      if (!inside) faults.push(`section ${k}: ${word.textContent} leaves the map`);
    }
    if (own.width === 0) faults.push(`section ${k} is not shown`);
  }
  return faults;
}"""
CONTRAST = """() => {
  const channels = text => (text.match(/[\\d.]+/g) ?? []).slice(0, 3).map(Number);
  const light = text => {
    const [r, g, b] = channels(text).map(c => (c /= 255) <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const ground = light(getComputedStyle(document.body).backgroundColor);
  let least = Infinity;
  for (const element of document.querySelectorAll("body *")) {
    const words = [...element.childNodes].some(node => node.nodeType === 3 && node.textContent.trim());
    const style = getComputedStyle(element);
    const drawn = element instanceof SVGElement;
    if (words && (!drawn || element.tagName === "text")) {
      const ink = light(drawn ? style.fill : style.color);
      least = Math.min(least, (ground + 0.05) / (ink + 0.05));
    }
  }
  return least;
}"""

# Of each: the scene, further arguments, the pages, and what has to stand on them. The crew, the leader of each dragon, and
# ten benches a page.
SHEETS = [
    ("village", [], 11, ["cue: the head turns round", "bench 11, left, 21 cm, 1:18", "1.4 m south of the northern spectators"]),
    ("village", ["--lang", "zh"], 11, ["提示：the head turns round", "11 号凳，左，21 厘米，1:18"]),
    ("square", [], 4, ["right, quarter circle, 9.4 s", "2.5 m west of the well"]),
    ("paper", ["--benches", "1-20", "--offset", "01:00:00:00"], 4, ["STOP: bench 1 and bench 9 touch", "01:06:52:12"]),
    ("crossing", [], None, ["gold"]),
]


def printed(page, file):
    """The size of a page in millimetres, the number of pages, and the words of a file on paper."""
    requests = []
    page.on("request", lambda request: requests.append(request.url))
    page.goto(file.as_uri())
    page.emulate_media(media="print")
    pdf = page.pdf(prefer_css_page_size=True)
    assert requests == [file.as_uri()], requests
    (size,) = set(re.findall(rb"/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", pdf))
    count = len(re.findall(rb"/Type /Page\b", pdf))
    return [round(float(points) / 72 * 25.4) for points in size], count, page.locator("body").inner_text()


def main():
    with tempfile.TemporaryDirectory() as folder, browser() as chromium:
        for number, (scene, more, pages, words) in enumerate(SHEETS):
            file = pathlib.Path(folder) / f"{number}.html"
            subprocess.run([PROGRAM, "sheets", f"config/{scene}.toml", "-o", file, *more], check=True)
            page = chromium.new_page()
            size, count, text = printed(page, file)
            faults, contrast = page.evaluate(FAULTS), page.evaluate(CONTRAST)
            print(f"{scene}: {count} pages of {size} mm, contrast {contrast:.1f}, {faults}")
            assert size == [148, 210], size
            assert count == page.locator("section").count() == (pages or count), (scene, count)
            assert not faults, faults
            # Black on white is 21.
            assert contrast > 20.9, contrast
            missing = [word for word in words if word not in text]
            assert not missing, missing
            page.close()


if __name__ == "__main__":
    main()
