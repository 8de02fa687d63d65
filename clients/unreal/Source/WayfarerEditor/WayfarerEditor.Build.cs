using UnrealBuildTool;

// The node of animation graphs, as the editor shows it.
public class WayfarerEditor : ModuleRules
{
    public WayfarerEditor(ReadOnlyTargetRules Target) : base(Target)
    {
        PCHUsage = PCHUsageMode.UseExplicitOrSharedPCHs;
        PublicDependencyModuleNames.AddRange(new[] { "Core", "CoreUObject", "Engine", "AnimGraph", "BlueprintGraph", "Wayfarer" });
    }
}
