// Starts the page, or says which module is missing on the server.

import('/page/page.js').catch((error) => {
  console.warn(error);
  const connection = document.getElementById('connection');
  connection.textContent = 'not started';
  connection.dataset.state = 'lost';
  document.getElementById('notice').textContent =
      'This page lacks the packages that it follows and shows the scene with: run ./dev web where the server runs.';
});
