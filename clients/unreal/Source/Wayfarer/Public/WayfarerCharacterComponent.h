#pragma once

#include "CoreMinimal.h"
#include "Components/ActorComponent.h"
#include "WayfarerPose.h"
#include "WayfarerCharacterComponent.generated.h"

class FJsonObject;
class USkeletalMeshComponent;
class UWayfarerSubsystem;
struct wf_map;
struct wf_retarget;
struct wf_root;

/**
 * Makes the actor's skeletal mesh walk like an agent: any humanoid skeleton. Bones are found by their names, or by the
 * skeleton's shape. If the mesh has no animation class, it gets UWayfarerAnimInstance; otherwise put the node "Wayfarer
 * Pose" into its graph.
 */
UCLASS(ClassGroup = Wayfarer, meta = (BlueprintSpawnableComponent))
class WAYFARER_API UWayfarerCharacterComponent : public UActorComponent
{
	GENERATED_BODY()

public:
	UWayfarerCharacterComponent();

	/** The agent to show; "": create an agent where the actor stands. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = Wayfarer)
	FString AgentId;
	/** An agent made here has the character's proportions, so that its steps fit the character's legs. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = Wayfarer)
	bool bFitBody = true;
	/** The actor follows the agent: a point on the ground and a yaw that do not sway with the hips. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = Wayfarer)
	bool bMoveActor = true;
	/** Height of the actor's origin above the ground: of a Character, its capsule's half height. */
	UPROPERTY(EditAnywhere, BlueprintReadWrite, Category = Wayfarer)
	double OriginHeight = 0;
	/** Corrections of the map: "spine3" → the mesh's bone; None: it has none. */
	UPROPERTY(EditAnywhere, Category = Wayfarer)
	TMap<FName, FName> CorrectedBones;

	/** Send the agent to a place, centimetres; speed in centimetres per second. Waits for the agent if necessary. */
	UFUNCTION(BlueprintCallable, Category = Wayfarer)
	void GoTo(const FVector& Location, double Speed = 120);
	/** The map of the mesh's bones, to show it. Empty before the first pose. */
	UFUNCTION(BlueprintCallable, Category = Wayfarer)
	TMap<FName, FName> BoneTable() const;
	/** Why there is no pose; "" when there is one. */
	UFUNCTION(BlueprintCallable, Category = Wayfarer)
	FString Problem() const { return Why; }

	/** The pose of this frame. Game thread. */
	const FWayfarerPose& Pose() const { return Current; }

	virtual void BeginPlay() override;
	virtual void EndPlay(const EEndPlayReason::Type Reason) override;
	virtual void TickComponent(float DeltaTime, ELevelTick TickType, FActorComponentTickFunction* ThisTickFunction) override;

private:
	bool FindBones();
	void MeasureSoles();
	TSharedPtr<FJsonObject> Proportions() const;
	bool Prepare(const UWayfarerSubsystem& Subsystem, uint32 Alias);
	void Forget();
	void Show(const float* Frame, size_t Count, double Moment);

	UPROPERTY(Transient)
	TObjectPtr<USkeletalMeshComponent> Mesh;
	FWayfarerPose Current;
	FString Why;
	TArray<int32> Bones; // canonical numbers, in the order of Current.MeshBones
	TArray<FTransform> Parents; // of each placed bone, in the component's space, at rest
	TArray<uint8> Hanging;      // of each placed bone: whether its parent moves
	uint32 ShownAlias = 0, ShownGeneration = 0;
	bool bFailed = false, bCreated = false;
	TOptional<TPair<FVector, double>> WaitingGoal;
	wf_map* Map = nullptr;
	wf_retarget* Retarget = nullptr;
	wf_root* Root = nullptr;
};
