"""The paper's layer: ROS publishers and subscribers, REST resources and SOAP services, and no simulation."""
