"""The window: Dear ImGui (imgui-bundle) over ``composer.editor``'s workspace. Only modules here know the toolkit."""
