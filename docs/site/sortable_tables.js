// Tables with more than eight rows are sorted by a click on the head of a column.
"use strict";

// "12 (3 to 4)" is 12, "3/20 (…)" is 0.15, "−0.5" is −0.5; other texts have no number.
function leadingNumber(text) {
    const found = text.replaceAll("−", "-").replaceAll(",", "").match(/^[^\d-]{0,2}(-?\d+(?:\.\d+)?)(?:\/(\d+))?/);
    return found ? Number(found[1]) / Number(found[2] ?? 1) : NaN;
}

function compareCells(one, other) {
    const [first, second] = [leadingNumber(one), leadingNumber(other)];
    if (Number.isNaN(first) !== Number.isNaN(second)) return Number.isNaN(first) ? 1 : -1;
    return Number.isNaN(first) ? one.localeCompare(other) : first - second;
}

function sortBy(table, column, direction) {
    const body = table.tBodies[0];
    const text = (row) => row.cells[column]?.textContent.trim() ?? "";
    const rows = [...body.rows].sort((one, other) => direction * compareCells(text(one), text(other)));
    body.append(...rows);
}

function makeSortable(table) {
    for (const [column, head] of [...table.tHead.rows[0].cells].entries()) {
        if (!head.textContent.trim()) continue;
        const button = document.createElement("button");
        button.type = "button";
        button.append(...head.childNodes);
        head.append(button);
        button.addEventListener("click", () => {
            const ascending = head.getAttribute("aria-sort") !== "ascending";
            for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
            head.setAttribute("aria-sort", ascending ? "ascending" : "descending");
            sortBy(table, column, ascending ? 1 : -1);
        });
    }
}

for (const table of document.querySelectorAll("main table")) {
    if (table.tHead && table.tBodies[0]?.rows.length > 8) makeSortable(table);
}
