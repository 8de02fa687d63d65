using System.IO;
using UnrealBuildTool;

// The C++ core (clients/cpp), which knows no engine: its sources are compiled here, and others see its C ABI.
public class WayfarerCore : ModuleRules
{
    public WayfarerCore(ReadOnlyTargetRules Target) : base(Target)
    {
        string Core = Path.Combine(PluginDirectory, "ThirdParty", "wayfarer");
        if (!Directory.Exists(Core)) Core = Path.GetFullPath(Path.Combine(PluginDirectory, "..", "cpp"));
        if (!File.Exists(Path.Combine(Core, "include", "wayfarer", "wayfarer.h")))
        {
            throw new BuildException("Wayfarer: copy clients/cpp to " + Path.Combine(PluginDirectory, "ThirdParty", "wayfarer"));
        }
        PublicSystemIncludePaths.Add(Path.Combine(Core, "include"));
        PrivateIncludePaths.Add(Path.Combine(Core, "src"));
        PublicDefinitions.Add("WF_API=WAYFARERCORE_API");
        PublicDependencyModuleNames.Add("Core");
        bEnableExceptions = true; // none leaves the C ABI
        bUseUnity = false;        // WayfarerCore.cpp must not meet the engine's macros
        PCHUsage = PCHUsageMode.NoPCHs;
    }
}
