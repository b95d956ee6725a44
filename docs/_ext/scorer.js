// Ranks the results of a search: pages that explain come before the pages of single names.
var FOLDERS = [
  [/^(tutorial|howto)\//, 30],
  [/^reference\/glossary/, 30],
  [/^(gallery|explanation)\//, 20],
  [/^numerics\/notes\//, -5],
  [/^numerics\//, 12],
  [/^reference\/generated\/(gapwalk\.|records)/, 0],
  [/^reference\//, 6],
];

var Scorer = {
  score: function (result) {
    var found = FOLDERS.find(function (each) { return each[0].test(result[0]); });
    return result[4] + (found ? found[1] : 10);
  },
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
