"""The editor: a document layer without a window, and a window on top of it (``composer.editor.window``)."""
