// Starts `uav-bt lsp` for tree files; everything else is the server's.
const { workspace } = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

let client;

exports.activate = () => {
  const settings = workspace.getConfiguration("uav-bt");
  const server = { command: settings.get("command"), args: settings.get("arguments") };
  const documents = [{ language: "behaviortree" }];
  client = new LanguageClient("uav-bt", "uav-bt", server, { documentSelector: documents });
  return client.start();
};

exports.deactivate = () => client && client.stop();
