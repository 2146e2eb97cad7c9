"""Small MJCF files: an arm of two links, and arms with one fault each."""

ARM = """\
<mujoco model="arm">
  <option timestep="0.01"/>
  <worldbody>
    <light pos="0 0 4"/>
    <camera name="front" pos="0 -3 0.5" xyaxes="1 0 0 0 0 1"/>
    <geom name="floor" type="plane" size="3 3 .1" pos="0 0 -0.6"/>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" damping=".5"/>
      <geom name="upper" type="capsule" fromto="0 0 0 .5 0 0" size=".04"/>
      <body name="fore" pos=".5 0 0">
        <joint name="elbow" axis="0 1 0" damping=".5" range="-150 150"/>
        <geom name="fore" type="capsule" fromto="0 0 0 .5 0 0" size=".04"/>
        <site name="tip" pos=".55 0 0" size=".06"/>
      </body>
    </body>
    <body name="puck" pos="1 0 0">
      <freejoint name="puck"/>
      <geom name="puck" type="sphere" size=".05"/>
    </body>
  </worldbody>
  <actuator>
    <position name="shoulder" joint="shoulder" kp="60" kv="6" ctrlrange="-2 2"/>
    <motor name="elbow" joint="elbow" gear="10" ctrlrange="-1 1"/>
  </actuator>
  <sensor>
    <touch name="touch" site="tip"/>
    <accelerometer name="shaking" site="tip"/>
  </sensor>
  <keyframe>
    <key name="home" qpos="0.2 0.4 1 0 0 1 0 0 0" ctrl="0 0"/>
  </keyframe>
</mujoco>
"""


def changed(*pairs: tuple[str, str]) -> str:
    """The arm with other text in places."""
    text = ARM
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new, 1)
    return text


def without(section: str) -> str:
    """The arm without a section."""
    start, end = ARM.index(f"  <{section}>"), ARM.index(f"</{section}>") + len(f"</{section}>\n")
    return ARM[:start] + ARM[end:]


MODELS = {
    "arm.xml": ARM,
    "bare.xml": without("actuator").replace(' ctrl="0 0"', ""),
    "still.xml": '<mujoco><worldbody><geom size="1"/></worldbody></mujoco>',
    "unlimited.xml": changed((' kv="6" ctrlrange="-2 2"', ' kv="6"')),
    "degrees.xml": changed(
        ('kv="6" ctrlrange="-2 2"', 'kv="6" ctrlrange="-100 100"'),
        ('axis="0 1 0" damping=".5"', 'axis="0 1 0" damping=".5" range="-100 100"'),
    ),
    "short_key.xml": changed(("0.2 0.4 1 0 0 1 0 0 0", "0.2 0.4")),
    "no_sensor.xml": without("sensor"),
    "no_key.xml": without("keyframe"),
    "broken.xml": ARM.replace("</body>", "", 1),
    "long_key.xml": changed(("0.2 0.4 1 0 0 1 0 0 0", "0.2 0.4 1 0 0 1 0 0 0 0")),
    "unknown_joint.xml": without("keyframe").replace('joint="elbow" gear', 'joint="elbo" gear'),
    "massless.xml": "<mujoco><worldbody><body>\n<joint/></body></worldbody></mujoco>",
    "tendon.xml": changed(
        ("  <actuator>", '  <tendon><fixed name="t"><joint joint="elbow" coef="1"/></fixed></tendon>\n  <actuator>'),
        ('joint="elbow" gear', 'tendon="t" gear'),
    ),
    "other_joint.xml": changed(
        ('<joint name="elbow"', '<joint name="hinge"'), ('joint="elbow" gear', 'joint="hinge" gear')
    ),
}
