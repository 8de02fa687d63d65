#include "AnimGraphNode_Wayfarer.h"

#include "Modules/ModuleManager.h"

FText UAnimGraphNode_Wayfarer::GetNodeTitle(ENodeTitleType::Type) const
{
	return NSLOCTEXT("Wayfarer", "NodeTitle", "Wayfarer Pose");
}

FText UAnimGraphNode_Wayfarer::GetTooltipText() const
{
	return NSLOCTEXT("Wayfarer", "NodeTip", "The pose of the actor's Wayfarer Character component, over the pose that comes in");
}

IMPLEMENT_MODULE(FDefaultModuleImpl, WayfarerEditor)
