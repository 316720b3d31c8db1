"use strict";
for (const head of document.querySelectorAll(".drives th button")) {
  head.addEventListener("click", () => {
    const body = document.querySelector(".drives tbody"), at = head.parentElement.cellIndex;
    const up = head.parentElement.getAttribute("aria-sort") === "ascending" ? -1 : 1;
    for (const other of head.parentElement.parentElement.cells) other.removeAttribute("aria-sort");
    head.parentElement.setAttribute("aria-sort", up > 0 ? "ascending" : "descending");
    const key = row => row.cells[at].dataset.key ?? row.cells[at].textContent;
    const number = text => text === "" ? -Infinity : Number(text);
    const rows = [...body.rows], numeric = rows.every(row => !Number.isNaN(number(key(row))));
    rows.sort((a, b) => up * (numeric ? number(key(a)) - number(key(b)) : key(a).localeCompare(key(b))));
    body.append(...rows);
  });
}
