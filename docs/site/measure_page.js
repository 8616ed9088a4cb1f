/* Measure a page of the site on the screen that it is on: docs/site/look.py names what is returned. */
() => {
  const root = document.documentElement;
  const article = document.querySelector("article");
  const shown = (element) => element.getClientRects().length > 0;
  const all = (selector) => [...(article ? article.querySelectorAll(selector) : [])].filter(shown);
  const style = (element) => getComputedStyle(element);
  const name = (element) => {
    const words = (element.textContent.trim() || element.alt || "").replace(/\s+/g, " ").slice(0, 40);
    return `${element.tagName.toLowerCase()} "${words}"`;
  };

  /* The edge of the column, or of the card within it, up to which a box is read. */
  const edge = (element) => (element.closest(".sd-card, .bd-article") ?? root).getBoundingClientRect().right + 1;
  const scrolls = (element) => ["auto", "scroll"].includes(style(element).overflowX);
  const isInside = (element) => {
    const right = edge(element);
    for (let box = element; box && box !== article; box = box.parentElement) {
      const ends = box.getBoundingClientRect().right <= right;
      if (ends && (scrolls(box) || (box === element && box.scrollWidth <= box.clientWidth + 1))) return true;
    }
    return false;
  };

  const bottom = (selector, text = "") => {
    const found = [...document.querySelectorAll(`.first-screen ${selector}`)].find(
      (element) => shown(element) && element.textContent.includes(text),
    );
    return found ? found.getBoundingClientRect().bottom : Infinity;
  };

  return {
    width: root.clientWidth,
    scroll_width: root.scrollWidth,
    links: [...document.querySelectorAll(".bd-sidebar-primary .bd-docs-nav a")].filter(shown).length,
    outside: all("table, pre, img").filter((element) => !isInside(element)).map(name),
    wrapped: [
      ...all(".printed pre, .cell_output pre").filter((block) => style(block).whiteSpace !== "pre"),
      ...all("td:not(.long), th:not(.long)").filter((cell) => !cell.closest(".genindextable")).filter((cell) => style(cell).whiteSpace !== "nowrap"),
    ].map(name),
    first_screen: {
      installation: bottom("pre", "pip install"),
      code: bottom(".highlight-python pre"),
      figure: bottom("img"),
    },
    thumbnails: all(".thumbnail img").map((image) => image.getBoundingClientRect().width),
  };
};
