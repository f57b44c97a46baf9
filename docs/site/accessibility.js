"use strict";
/* What mdBook leaves out for keyboards and screen readers. */

/** The button of the side bar is a label, which has no role of its own. */
function nameTheSideBarButton() {
  const button = document.getElementById("mdbook-sidebar-toggle");
  if (button) Object.assign(button, { role: "button", tabIndex: 0 });
}

/** Whoever has no mouse scrolls wide code and tables with arrow keys, after Tab has reached them. */
function focusWideContent() {
  for (const element of document.querySelectorAll("pre > code, .table-wrapper")) {
    if (element.scrollWidth > element.clientWidth) element.tabIndex = 0;
  }
}

addEventListener("DOMContentLoaded", nameTheSideBarButton);
addEventListener("load", focusWideContent);
