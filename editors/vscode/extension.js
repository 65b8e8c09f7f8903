// Starts `rtsg validate --lsp` for documents of X3D and VRML, and passes on what it answers.
"use strict";

const vscode = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

let client;

function activate() {
    const settings = vscode.workspace.getConfiguration("rtsg");
    const command = settings.get("program"), args = ["validate", "--lsp", ...settings.get("arguments")];
    client = new LanguageClient("rtsg", "RTSG", { command, args },
                                { documentSelector: [{ language: "x3dv" }, { language: "x3d" }] });
    return client.start().catch(error => {
        vscode.window.showErrorMessage(`X3D: ${command} does not start (setting rtsg.program): ${error.message ?? error}`);
    });
}

function deactivate() {
    return client && client.stop();
}

module.exports = { activate, deactivate };
