/** The recordings of a page that `maes view --export` has written. */

/** The element with the query that shows them; see `maes/src/view/export.rs`. */
const ELEMENT = 'meta[name="maes-query"]';

/**
 * The query of the page. An exported page adds its recordings to an address that names none, so that
 * links from it name them.
 */
export function pageQuery(): string {
  const exported = document.querySelector<HTMLMetaElement>(ELEMENT)?.content;
  const query = new URLSearchParams(location.search);
  if (exported && !query.has("recording") && !query.has("server")) {
    const view = location.search.slice(1);
    history.replaceState(null, "", `?${exported}${view && `&${view}`}`);
  }
  return location.search;
}
