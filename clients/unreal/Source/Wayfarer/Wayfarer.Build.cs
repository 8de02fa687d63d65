using UnrealBuildTool;

public class Wayfarer : ModuleRules
{
    public Wayfarer(ReadOnlyTargetRules Target) : base(Target)
    {
        PCHUsage = PCHUsageMode.UseExplicitOrSharedPCHs;
        PublicDependencyModuleNames.AddRange(new[] { "Core", "CoreUObject", "Engine", "WayfarerCore" });
        PrivateDependencyModuleNames.AddRange(new[] { "HTTP", "Json", "WebSockets" });
    }
}
