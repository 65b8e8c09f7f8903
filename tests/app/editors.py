#!/usr/bin/env python3
"""Do the files for editors work: is the grammar of VS Code right, and does Neovim speak with the program?

Exit status 77 where neither vscode-tmgrammar-test (npm install in editors/vscode) nor Neovim is installed.
"""
import argparse
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
EDITORS = ROOT / "editors"

# What is done within Neovim: faults, a rename and indentation; what came of it goes into a file.
STEPS = """
local result = {}
local function ask(method, more)
  local params = vim.lsp.util.make_position_params()
  for name, value in pairs(more) do params[name] = value end
  local answers = vim.lsp.buf_request_sync(0, method, params, 20000) or {}
  for _, answer in pairs(answers) do return answer.result end
end
vim.wait(20000, function() return #vim.diagnostic.get(0) > 0 end, 20)
for _, one in ipairs(vim.diagnostic.get(0)) do table.insert(result, one.message) end
vim.api.nvim_win_set_cursor(0, {2, 5})
local edit = ask("textDocument/rename", {newName = "Lamp"})
vim.lsp.util.apply_workspace_edit(edit, "utf-16")
vim.api.nvim_buf_set_lines(0, 2, 3, false, {"Transform { translation 1 2 3 }"})
vim.wait(20000, function() return #vim.diagnostic.get(0) == 0 end, 20)
local edits = ask("textDocument/formatting", {options = {tabSize = 2, insertSpaces = true}})
vim.lsp.util.apply_text_edits(edits, 0, "utf-16")
local symbols = ask("textDocument/documentSymbol", {})
vim.fn.writefile({vim.fn.json_encode({faults = result, left = #vim.diagnostic.get(0), symbols = #symbols,
  lines = vim.api.nvim_buf_get_lines(0, 0, -1, false)})}, RESULT)
vim.cmd("qa!")
"""


def grammar():
    """False: there is no tester."""
    for name in ("package.json", "language-configuration.json", "syntaxes/x3d.tmLanguage.json", "syntaxes/x3dv.tmLanguage.json"):
        json.loads((EDITORS / "vscode" / name).read_text(encoding="utf-8"))
    tester = EDITORS / "vscode/node_modules/.bin/vscode-tmgrammar-test"
    tester = str(tester) if tester.exists() else shutil.which("vscode-tmgrammar-test")
    if not tester:
        return False
    subprocess.run([tester, "test/words.x3dv"], cwd=EDITORS / "vscode", check=True)
    return True


def neovim(program):
    """False: it is not installed."""
    if not shutil.which("nvim"):
        return False
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        scene = folder / "a.x3dv"
        scene.write_text("#X3D V4.0 utf8\nDEF L PointLight { }\nTransform { translaton 1 2 3 }\nGroup {\nchildren USE L\n}\n", encoding="utf-8")
        steps = folder / "steps.lua"
        steps.write_text(f'local RESULT = "{folder / "result"}"\n{STEPS}', encoding="utf-8")
        subprocess.run(["nvim", "--headless", "--clean", "--cmd", f'let g:rtsg_program = "{program}"', "--cmd", f"luafile {EDITORS / 'neovim/x3d.lua'}",
                        str(scene), "-c", f"luafile {steps}"], check=True, timeout=120)
        result = json.loads((folder / "result").read_text(encoding="utf-8"))
    assert len(result["faults"]) == 2 and "PROFILE" in result["faults"][0] and "did you mean translation?" in result["faults"][1], result
    assert result["left"] == 1 and result["symbols"] == 3, result
    assert result["lines"] == ["#X3D V4.0 utf8", "DEF Lamp PointLight { }", "Transform { translation 1 2 3 }", "Group {", "  children USE Lamp", "}"], result
    return True


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", required=True)
    program = pathlib.Path(parser.parse_args().program).resolve()
    ran = {"the grammar's test (npm install in editors/vscode)": grammar(), "Neovim": neovim(program)}
    for what in (what for what, done in ran.items() if not done):
        print(f"not run: {what}")
    return 0 if any(ran.values()) else 77


if __name__ == "__main__":
    sys.exit(main())
