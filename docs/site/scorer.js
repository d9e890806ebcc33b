// Sphinx scores a page by its best word. Of equals, guides come first, then references, then single requirements.
var Scorer = {
  score: ([docname, , , , score]) =>
    score + (/^(requirements|fixes)\//.test(docname) ? 0 : /^(cli|statement|results|contract|design|caught)$/.test(docname) ? 4 : 8),
  objNameMatch: 11, objPartialMatch: 6, objPrio: { 0: 15, 1: 5, 2: -5 }, objPrioDefault: 0,
  title: 25, partialTitle: 9, term: 5, partialTerm: 2,
};
