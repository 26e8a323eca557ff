// The answers of the book's own search: node search.js BOOK WORDS… prints, for each WORDS, the pages that are found, best first (JSON).
// The index, its options and the search are those that the book's search field uses.
"use strict";
const fs = require("fs");
const path = require("path");
const vm = require("vm");

const [book, ...questions] = process.argv.slice(2);
const file = (start) => fs.readdirSync(book).find((name) => name.startsWith(start) && name.endsWith(".js"));
const window = { search: {} };
const context = vm.createContext({ window, module: undefined });
context.self = context;
for (const start of ["elasticlunr", "searchindex"]) {
    vm.runInContext(fs.readFileSync(path.join(book, file(start)), "utf8"), context);
}
const config = window.search;
const index = vm.runInContext("elasticlunr", context).Index.load(config.index);
const pages = questions.map((words) =>
    index.search(words, config.search_options).map((found) => config.doc_urls[parseInt(found.ref, 10)]));
console.log(JSON.stringify(pages));
