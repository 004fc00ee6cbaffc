// The page itself: theme, rows, shader tabs.

const darkPreferred = matchMedia('(prefers-color-scheme: dark)');

function startTheme() {
  const button = byId('theme'), root = document.documentElement;
  const isDark = () => root.style.colorScheme ? root.style.colorScheme === 'dark' : darkPreferred.matches;
  const update = () => {
    button.textContent = isDark() ? 'Light theme' : 'Dark theme';
    if (residualPanel.slices) residualPanel.draw();
    if (explorerPanel.explorer) explorerPanel.draw();
  };
  button.hidden = false;
  button.addEventListener('click', () => {
    root.style.colorScheme = isDark() ? 'light' : 'dark';
    update();
  });
  darkPreferred.addEventListener('change', update);
  update();
}

/** The texts of one row behind tabs, with a button that copies the chosen one. */
function startTabs(section) {
  const panels = [...section.querySelectorAll('.shader')];
  const bar = make('div', { class: 'tabs' }), list = make('div', { class: 'tabs', role: 'tablist', 'aria-label': 'Shader language' });
  const copy = make('button', { type: 'button', class: 'copy' }, 'Copy');
  const base = section.closest('.row').id;
  let chosen = 0;
  const tabs = panels.map((panel, k) => {
    panel.id = `${base}-${panel.dataset.language}`;
    panel.setAttribute('role', 'tabpanel');
    panel.querySelector('h5').hidden = true;
    const tab = make('button', { type: 'button', role: 'tab', id: `${panel.id}-tab`, 'aria-controls': panel.id },
        panel.dataset.language.toUpperCase());
    panel.setAttribute('aria-labelledby', tab.id);
    tab.addEventListener('click', () => choose(k));
    return tab;
  });
  const choose = (k) => {
    chosen = k;
    copy.textContent = 'Copy';
    tabs.forEach((tab, t) => {
      tab.setAttribute('aria-selected', String(t === k));
      tab.tabIndex = t === k ? 0 : -1;
      panels[t].hidden = t !== k;
    });
  };
  list.addEventListener('keydown', (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step) return;
    event.preventDefault();
    choose((chosen + step + tabs.length) % tabs.length);
    tabs[chosen].focus();
  });
  copy.addEventListener('click', async () => {
    const code = panels[chosen].querySelector('code');
    try {
      await navigator.clipboard.writeText(code.textContent);
      copy.textContent = 'Copied';
    } catch {
      // Where the clipboard is closed to pages, the text is at least selected.
      getSelection().selectAllChildren(code);
      copy.textContent = 'Selected';
    }
  });
  list.append(...tabs);
  bar.append(list, copy);
  section.querySelector('h4').after(bar);
  choose(0);
}

function startRows() {
  if (!data.rows.length) return;
  document.documentElement.classList.add('scripted');
  const select = byId('row'), articles = [...document.querySelectorAll('article.row')];
  select.append(...data.rows.map((row, k) => make('option', { value: k }, row.name)));
  byId('chooser').hidden = data.rows.length < 2;
  if (data.rows.length < 2) byId('rows-title').textContent = data.rows[0].name;
  const show = () => {
    const row = data.rows[select.value], article = articles[select.value];
    articles.forEach((other) => { other.hidden = other !== article; });
    byId('row-note').textContent = row.note;
    const slices = row.slices && new Slices(row.slices);
    slicePanel.show(slices);
    residualPanel.show(slices);
    const glsl = article.querySelector('[data-language="glsl"] code');
    explorerPanel.show(row.explorer, glsl && glsl.textContent, slices);
  };
  slicePanel.start();
  residualPanel.start();
  explorerPanel.start();
  slicePanel.onChange = () => {
    if (residualPanel.slices !== slicePanel.slices) return;
    residualPanel.draw();
    if (explorerPanel.row !== slicePanel.place().row) explorerPanel.chooseRow(slicePanel.place().row);
  };
  document.querySelectorAll('.shaders').forEach(startTabs);
  select.addEventListener('input', show);
  show();
}

startTheme();
startRows();
