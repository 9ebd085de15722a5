// viser has no key `?`, which is that of the help, `h`, and none that closes a window; a tab that
// was clicked keeps the space bar to itself.
if (!window.asperityKeys) {
  window.asperityKeys = true;
  const forward = (key, code) => document.documentElement.dispatchEvent(
    new KeyboardEvent('keydown', {key, code, bubbles: true, cancelable: true}));
  document.addEventListener('keydown', (event) => {
    const target = event.target;
    if (event.key === '?' && !/^(INPUT|TEXTAREA)$/.test(target.tagName)) forward('h', 'KeyH');
    if (event.key === 'Escape') {
      const buttons = document.querySelectorAll('.mantine-Modal-content button');
      if (buttons.length) buttons[buttons.length - 1].click();
    }
    if (event.key === ' ' && target.getAttribute('role') === 'tab') {
      event.preventDefault();
      event.stopPropagation();
      target.blur();
      forward(' ', 'Space');
    }
  }, true);
}
