// Tables that sort: each heading becomes a button. Without this script they are as written.
for (const table of document.querySelectorAll("table.sorts")) {
  const body = table.tBodies[0];
  const number = (text) => parseFloat(text.replace(/(\d),(?=\d{3})/g, "$1"));
  [...table.tHead.rows[0].cells].forEach((heading, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...heading.childNodes);
    heading.append(button);
    button.addEventListener("click", () => {
      const rows = [...body.rows].map((row) => [row, row.cells[column].textContent.trim()]);
      const numeric = rows.some(([, text]) => !Number.isNaN(number(text)));
      // Numbers begin with the largest, words with the first letter; the next press turns it round.
      const first = numeric ? "descending" : "ascending";
      const other = numeric ? "ascending" : "descending";
      const order = heading.getAttribute("aria-sort") === first ? other : first;
      for (const each of heading.parentNode.cells) each.removeAttribute("aria-sort");
      heading.setAttribute("aria-sort", order);
      const turn = order === "ascending" ? 1 : -1;
      rows.sort(([, a], [, b]) => {
        if (!numeric) return turn * a.localeCompare(b);
        const [x, y] = [number(a), number(b)];
        // A cell without a number comes last, whichever way.
        if (Number.isNaN(x) || Number.isNaN(y)) return Number.isNaN(x) - Number.isNaN(y);
        return turn * (x - y);
      });
      body.append(...rows.map(([row]) => row));
    });
  });
}
