#pragma once

#include "AnimGraphNode_Base.h"
#include "AnimNode_Wayfarer.h"
#include "AnimGraphNode_Wayfarer.generated.h"

/** "Wayfarer Pose" in animation graphs. */
UCLASS()
class UAnimGraphNode_Wayfarer : public UAnimGraphNode_Base
{
	GENERATED_BODY()

public:
	UPROPERTY(EditAnywhere, Category = Settings)
	FAnimNode_Wayfarer Node;

	virtual FText GetNodeTitle(ENodeTitleType::Type TitleType) const override;
	virtual FText GetTooltipText() const override;
};
