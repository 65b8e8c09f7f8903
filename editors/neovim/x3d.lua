-- Neovim 0.7 and later: errors, completion, outline, rename and indentation in X3D and VRML, by `rtsg validate --lsp`.
-- Copy this file to ~/.config/nvim/plugin/. The variable g:rtsg_program names the program if it is not in PATH.
local kinds = { x3d = "x3d", x3dv = "x3dv", wrl = "x3dv", vrml = "x3dv" }
local group = vim.api.nvim_create_augroup("rtsg", {})
local client  -- of Neovim 0.7, which does not look for a client that runs

local function start(buffer)
  local file = vim.api.nvim_buf_get_name(buffer)
  local settings = { name = "rtsg", cmd = { vim.g.rtsg_program or "rtsg", "validate", "--lsp" }, root_dir = vim.fn.fnamemodify(file, ":h") }
  if vim.lsp.start then  -- 0.8
    vim.lsp.start(settings, { bufnr = buffer })
  else
    client = client or vim.lsp.start_client(settings)
    vim.lsp.buf_attach_client(buffer, client)
  end
end

for ending, kind in pairs(kinds) do
  vim.api.nvim_create_autocmd({ "BufRead", "BufNewFile" }, {
    group = group, pattern = "*." .. ending,
    callback = function(event)
      vim.bo[event.buf].filetype = kind
      vim.bo[event.buf].commentstring = kind == "x3dv" and "# %s" or "<!-- %s -->"
      start(event.buf)
    end,
  })
end
