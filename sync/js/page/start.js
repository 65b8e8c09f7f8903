// Starts the page, or says what it lacks: what it is made of is fetched where the server runs.

import('/page/page.js').catch((error) => {
  console.warn(error);
  const connection = document.getElementById('connection');
  connection.textContent = 'not started';
  connection.dataset.state = 'lost';
  document.getElementById('notice').textContent =
      'This page lacks the packages that it follows and shows the scene with: run ./dev web where the server runs.';
});
