// Values at the pointer, lines that can be hidden, and links from curves to runs. The page is
// complete without it. It loads nothing.
'use strict';
(() => {
  const names = JSON.parse(document.getElementById('names').textContent);
  const tip = document.createElement('div');
  tip.id = 'tip';
  tip.hidden = true;
  document.body.append(tip);
  const cursor = document.createElementNS('http://www.w3.org/2000/svg', 'line');
  cursor.id = 'cursor';

  // A link opens the section that it leads into.
  const reveal = () => {
    let element = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    for (const target = element; element; element = element.parentElement) {
      if (element.tagName === 'DETAILS' && !element.open) {
        element.open = true;
        target.scrollIntoView();
      }
    }
  };
  addEventListener('hashchange', reveal);
  reveal();

  // Points of a line in pixels of its image, parsed once.
  const parsed = new WeakMap();
  const points = (line) => {
    if (!parsed.has(line)) {
      const pairs = line.getAttribute('points').split(' ').filter(Boolean);
      parsed.set(line, pairs.map((pair) => pair.split(',').map(Number)));
    }
    return parsed.get(line);
  };
  // The height of a line at x: the last one of a jump, and none beyond its ends.
  const heightAt = (line, x) => {
    const all = points(line);
    if (!all.length || x < all[0][0] || x > all[all.length - 1][0]) return null;
    let low = 0;
    let high = all.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (all[middle][0] <= x) low = middle; else high = middle - 1;
    }
    const [from, to] = [all[low], all[Math.min(low + 1, all.length - 1)]];
    return to[0] > from[0] ? from[1] + (to[1] - from[1]) * (x - from[0]) / (to[0] - from[0]) : from[1];
  };
  const number = (value) => (Math.abs(value) < 9.95 ? value.toFixed(2) : value.toFixed(1));
  const isShown = (element) => !element.closest('[data-variant][hidden], [data-variant][style*="none"]');

  const show = (text, event) => {
    tip.textContent = text;
    tip.hidden = false;
    const { innerWidth: width, innerHeight: height } = window;
    const box = tip.getBoundingClientRect();
    const left = event.clientX + 14 + box.width > width ? event.clientX - 14 - box.width : event.clientX + 14;
    tip.style.left = `${Math.max(4, left)}px`;
    tip.style.top = `${Math.min(event.clientY + 14, height - box.height - 4)}px`;
  };
  let near = null;
  const hide = () => {
    tip.hidden = true;
    cursor.remove();
    near?.classList.remove('near');
    near = null;
  };

  const readCurves = (panel, event) => {
    const [left, top, width, height, x0, x1, y0, y1] = panel.dataset.plot.split(' ').map(Number);
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(panel.getScreenCTM().inverse());
    if (at.x < left || at.x > left + width || at.y < top || at.y > top + height) return null;
    const lines = [];
    for (const group of panel.querySelectorAll('[data-curve]')) {
      const line = group.querySelector('polyline');
      const y = line && isShown(group) ? heightAt(line, at.x) : null;
      if (y !== null) {
        lines.push(`${names[group.dataset.variant]}: ${number(y0 + (top + height - y) / height * (y1 - y0))}`);
      }
    }
    if (!lines.length) return null;
    for (const [name, value] of [['x1', at.x], ['x2', at.x], ['y1', top], ['y2', top + height]]) {
      cursor.setAttribute(name, value);
    }
    panel.append(cursor);
    let least = 8;
    for (const group of panel.querySelectorAll('[data-run]')) {
      const line = group.querySelector('polyline');
      const y = line && isShown(group) ? heightAt(line, at.x) : null;
      if (y !== null && Math.abs(y - at.y) < least) {
        least = Math.abs(y - at.y);
        near = group;
      }
    }
    near?.classList.add('near');
    const run = near ? `\nrun ${near.dataset.run} (click: its row)` : '';
    return `at ${number(x0 + (at.x - left) / width * (x1 - x0))}\n${lines.join('\n')}${run}`;
  };

  const point = (event) => {
    hide();
    const panel = event.target.closest?.('.panel');
    if (!panel) return;
    const valued = event.target.closest('[data-value]');
    const run = event.target.closest('[data-run]');
    let text = valued?.dataset.value ?? null;
    if (text && run) text += `\nrun ${run.dataset.run} (click: its row)`;
    if (!text && panel.dataset.plot) text = readCurves(panel, event);
    if (text) show(text, event);
  };
  document.addEventListener('pointermove', point);
  document.addEventListener('pointerdown', point);
  document.addEventListener('scroll', hide, { passive: true });

  // From a curve or a dot to the row of its run, also where the rows are folded away.
  const open = () => {
    const row = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    if (!row) return;
    row.closest('details')?.setAttribute('open', '');
    row.scrollIntoView({ block: 'center' });
  };
  document.addEventListener('click', (event) => {
    const run = event.target.closest?.('.panel') && (event.target.closest('[data-run]') ?? near);
    if (run) location.hash = `run-${run.dataset.run}`;
  });
  window.addEventListener('hashchange', open);
  open();

  // A variant is shown or hidden in all figures.
  for (const button of document.querySelectorAll('button[data-toggles]')) {
    button.addEventListener('click', () => {
      const isHidden = button.getAttribute('aria-pressed') === 'true';
      const { toggles } = button.dataset;
      for (const other of document.querySelectorAll(`button[data-toggles="${toggles}"]`)) {
        other.setAttribute('aria-pressed', String(!isHidden));
      }
      for (const group of document.querySelectorAll(`.panel [data-variant="${toggles}"]`)) {
        group.style.display = isHidden ? 'none' : '';
      }
      hide();
    });
  }
})();
